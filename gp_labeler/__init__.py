"""The application of gp-labeler: label guinea-pig head micro-CT, check estimated cochlea poses."""
