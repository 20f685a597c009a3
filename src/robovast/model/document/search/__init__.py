"""What a document's `search` section means: its space, its template, its criteria. No effects."""
