"""Does the test that ``cutcal design`` recommends narrow what was asked for as promised?"""
