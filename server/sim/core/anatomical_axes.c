/* Letters of a patient's axes: one of each pair, and right-handed. */
#include "server/sim/core/anatomical_axes.h"

#include <stddef.h>
#include <string.h>

const char *pal_anatomical_axes_fault(const char *axes)
{
    static const char letters[] =
        "RLAPSI"; /* pairs; the first of each is right, anterior, superior: a right-handed set */
    static const char wrong[] = "is not three letters, one of R and L, one of A and P, one of S and I";
    int pair[3], n_turned = 0, n_seen[3] = {0};
    if (!axes[0]) return NULL;
    if (strlen(axes) != 3) return wrong;
    for (int k = 0; k < 3; k++) {
        const char *at = strchr(letters, axes[k]);
        if (!at || n_seen[(at - letters) / 2]++) return wrong;
        pair[k] = (int)(at - letters) / 2;
        n_turned += (int)(at - letters) % 2;
    }
    /* each exchange of two axes and each turned axis mirrors once */
    const int n_exchanged = (pair[0] > pair[1]) + (pair[0] > pair[2]) + (pair[1] > pair[2]);
    return (n_turned + n_exchanged) % 2 ? "is left-handed, so the body would be shown as its mirror image" : NULL;
}
