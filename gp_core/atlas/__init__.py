"""The atlas: mean shape of the labelled features and its variation; fitting it, and checking labels by it."""
