"""Access control: API keys, browser sessions, authentication, rate limits and quotas."""
