pal_fuzz(hub LINK pal_net)
