"""HTML report: text, tables and figures of a result; it computes no statistics."""
