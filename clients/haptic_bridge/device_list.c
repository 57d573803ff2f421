#include "clients/haptic_bridge/device.h"
#include "clients/haptic_bridge/device_virtual.h"

#include <string.h>

const pal_haptic_v1 *pal_device_backend(int index)
{
    return index == 0 ? pal_device_virtual() : NULL;
}

const pal_haptic_v1 *pal_device_find(const char *name, size_t n_name)
{
    const pal_haptic_v1 *backend;
    for (int i = 0; (backend = pal_device_backend(i)); i++)
        if (strlen(backend->name) == n_name && !strncmp(backend->name, name, n_name)) return backend;
    return NULL;
}
