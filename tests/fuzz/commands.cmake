pal_fuzz(study LINK pal_commands)
