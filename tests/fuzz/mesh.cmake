pal_fuzz(prepared LINK pal_mesh)
pal_fuzz(cell_file LINK pal_mesh)
pal_fuzz(cell_edit LINK pal_mesh)
pal_fuzz(image_file LINK pal_mesh)
