"""The .vast document and everything derived from it without effects: variants, plan, packs."""
