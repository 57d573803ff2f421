pal_fuzz(mesh_file LINK pal_mesh)
pal_fuzz(label_volume LINK pal_mesh)
pal_fuzz(volume_header LINK pal_mesh)
