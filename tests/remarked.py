"""What remarks and warnings say, for tests of their words."""


def remarked(remarks, words):
    """Whether one of the remarks, or of their texts, has these words."""
    return any(words in str(remark) for remark in remarks)
