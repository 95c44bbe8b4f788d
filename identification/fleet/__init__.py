"""Many motors beside each other: a table of all, how each has drifted, and which stand out."""
