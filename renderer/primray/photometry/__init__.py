"""What lights of a description give in all: flux, illuminance, and the emission that gives as much as is asked for.

Numbers are luminance in the description's units: lengths are scene units. Nothing here is needed to render; lights that ask for
no amount (Photometric) never come here.
"""
