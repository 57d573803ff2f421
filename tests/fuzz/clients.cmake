pal_fuzz(lcm_walk LINK pal_lcm_link)
