"""The document and what follows from it, pure: variants, plan, packs of runs."""
