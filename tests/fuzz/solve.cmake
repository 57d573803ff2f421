pal_fuzz(problem LINK pal_scene)
pal_fuzz(samples LINK pal_solve)
