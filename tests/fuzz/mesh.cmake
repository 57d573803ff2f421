pal_fuzz(prepared LINK pal_mesh)
