"""Who may call: keys, the sessions of the web page, and the gate in front of every route."""
