"""The commands of ``gp-labeler``, one module each, and where both commands begin."""
