"""Publication: packs results into archives and uploads them."""
