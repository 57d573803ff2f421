#include "clients/haptic_bridge/device.h"
#include "clients/haptic_bridge/device_dhd.h"
#include "clients/haptic_bridge/device_haply.h"
#include "clients/haptic_bridge/device_hdapi.h"
#include "clients/haptic_bridge/device_input.h"
#include "clients/haptic_bridge/device_plugin.h"
#include "clients/haptic_bridge/device_virtual.h"

#include <string.h>

const pal_haptic_v1 *pal_device_backend(int index)
{
    static const pal_haptic_v1 *(*const backend[])(void) = {pal_device_virtual, pal_device_hdapi, pal_device_dhd,
                                                            pal_device_haply,   pal_device_input, pal_device_plugin};
    return (size_t)index < sizeof backend / sizeof backend[0] ? backend[index]() : NULL;
}

const pal_haptic_v1 *pal_device_find(const char *name, size_t n_name)
{
    const pal_haptic_v1 *backend;
    for (int i = 0; (backend = pal_device_backend(i)); i++)
        if (strlen(backend->name) == n_name && !strncmp(backend->name, name, n_name)) return backend;
    return NULL;
}
