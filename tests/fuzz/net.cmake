pal_fuzz(hub LINK pal_net)
pal_fuzz(sessions LINK pal_net)
