"""The records that flow between components, none of which knows how it was made."""
