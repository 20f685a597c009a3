"""Looking at results: what a page, a notebook or an assistant asks of a results folder.

Every module here only reads. A results folder may come from anywhere, so nothing in it is trusted:
paths stay inside it, sizes are bounded, and text is data.
"""
