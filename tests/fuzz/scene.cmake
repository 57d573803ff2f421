pal_fuzz(scene_json LINK pal_scene)
