"""Set posteriors of model files, compared with the exact posteriors of the same reference sets."""
