"""Code that all detectors share: network inputs, model cards, poses, evaluation and drawing."""
