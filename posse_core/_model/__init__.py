"""The records that components exchange. They do not depend on how they were made."""
