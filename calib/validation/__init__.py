"""What a fit is worth: metrics, null models, numerical checks, acceptance, prediction."""
