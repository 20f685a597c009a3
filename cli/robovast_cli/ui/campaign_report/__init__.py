"""A report of a campaign: one HTML file, or Markdown for a pull request."""
