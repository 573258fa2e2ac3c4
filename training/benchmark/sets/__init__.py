"""Set posteriors of files beside the exact posteriors of the same sets."""
