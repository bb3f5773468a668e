"""Clamping fingerprint: what an indicator shows of one clamping, finger-tight and at full force."""
