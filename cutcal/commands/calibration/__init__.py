"""Commands that read traces and fit."""
