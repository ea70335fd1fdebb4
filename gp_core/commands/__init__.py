"""What the words of ``gp-core`` do: each module adds its commands to the parser and runs them."""
