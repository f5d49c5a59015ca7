"""Young's modulus from a uniaxial compression test between two plates, with the project's own particles.

The law is rate-independent and hyperelastic. At given Poisson's ratio, plates and geometry the force is therefore
proportional to Young's modulus E at every strain. One simulation gives the unit curve F / (E A0), and each repeat is
fitted by scaling it. Strain is compression / height, stress is force / A0: both are engineering quantities.
"""
