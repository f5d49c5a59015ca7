"""What a run leaves: record, sections, surface, pieces, snapshots."""
