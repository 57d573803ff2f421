pal_fuzz(frame LINK pal_protocol)
pal_fuzz(asset LINK pal_protocol)
pal_fuzz(wire LINK pal_protocol)
pal_fuzz(control LINK pal_protocol)
