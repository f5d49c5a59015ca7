"""Files and terminal: YAML checks, folders of output, schemas, provenance, progress."""
