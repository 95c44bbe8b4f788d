"""Fork server: runs risky or long tasks in children forked from a preloaded process."""
