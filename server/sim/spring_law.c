/* Spring constants from E, nu and h. */
#include "server/sim/spring_law.h"

double pal_spring_constant_J(pal_spring_kind kind, const pal_material *material, double h_m)
{
    static const double factor[] = {0.2, 0.4, 1.0};
    return factor[kind] * material->young_Pa * h_m * h_m * h_m;
}

pal_err pal_spring_read(pal_spring_kind kind, pal_item *item, const pal_build *build, pal_spring *out)
{
    *out = (pal_spring){.kind = kind,
                        .k_J = pal_spring_constant_J(kind, &build->def->material, build->body->h_m),
                        .given = pal_item_has(item, "k_J")};
    PAL_TRY(pal_item_number(item, "k_J", 0, 1e60, &out->k_J, build->note));
    PAL_TRY(pal_item_number(item, "c_Js", 0, 1e60, &out->c_Js, build->note));
    PAL_TRY(pal_item_done(item, build->note));
    if (!build->body->tets)
        return pal_note_set(build->note, PAL_ERR_REFUSED, "%s: \"%s\" needs a body of tetrahedra", item->path,
                            item->name);
    return PAL_ERR_OK;
}

void pal_spring_material(pal_spring *spring, const pal_body *body, const pal_material *material)
{
    if (!spring->given) spring->k_J = pal_spring_constant_J(spring->kind, material, body->h_m);
}

size_t pal_spring_padded(int n)
{
    return ((size_t)n + PAL_SPRING_CHUNK - 1) / PAL_SPRING_CHUNK * PAL_SPRING_CHUNK;
}
