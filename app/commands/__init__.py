"""Commands of the command line: what they print, read and write, and how they exit."""
