"""The outline of a specimen from a silhouette photograph, a surface mesh, or numbers."""
