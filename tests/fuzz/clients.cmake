pal_fuzz(lcm_walk LINK pal_lcm_link)
pal_fuzz(haply_scan LINK pal_haptic_bridge)
pal_fuzz(input_events LINK pal_haptic_bridge)
pal_fuzz(relay LINK pal_relay)
