"""What a user takes away: result.json, the HTML report and the posterior file."""
