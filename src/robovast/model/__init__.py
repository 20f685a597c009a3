"""The document and what follows from it, without effects: variants, plan, packs of runs."""
