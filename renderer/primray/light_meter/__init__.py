"""Light measured at points: illuminance, cylindrical illuminance and daylight factors, each with a 95 % interval, and glare.

`meters` says where and what is measured, `facets` makes a scene of it that the renderer samples, `readings` has the
statistics, `measuring` puts these together, `sky` is the CIE's overcast sky, `glare` what dazzles, `page` a page to read.
"""
