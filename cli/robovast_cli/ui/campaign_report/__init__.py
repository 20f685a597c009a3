"""A report of a campaign that can be sent: one HTML file, or Markdown for a pull request."""
