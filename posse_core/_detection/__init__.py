"""What every detector shares, torch or not: pictures as nets see them, model cards, pose, drawing."""
