"""The fixed benchmark beside the Bayes limit, and comparisons on data of one's own."""
