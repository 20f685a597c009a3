"""From stored runs to answers: bags, postprocessing, tables, provenance, publication."""
