/* The member table: linear searches over a few dozen entries, without an index to maintain. */
#include "server/session/members.h"

#include "server/base/utf8.h"

#include <stdio.h>
#include <string.h>

/* reserved at the end of a name for " 64" */
enum { NAME_NUMBER = 4 };

void pal_members_init(pal_member_list *members, int n_tool)
{
    memset(members, 0, sizeof *members);
    members->n_tool = n_tool < 0 ? 0 : n_tool > PAL_TOOL_MAX ? PAL_TOOL_MAX : n_tool;
    members->next_id = 1;
}

/* keeps valid printable characters, merges and trims blanks, truncates at a whole character */
static void clean_name(const char *from, char to[PAL_MEMBER_NAME])
{
    size_t n_from = from ? strnlen(from, 4096) : 0, n = 0;
    bool blank = false;
    for (size_t at = 0; at < n_from;) {
        uint32_t code;
        int size = pal_utf8_next(from + at, n_from - at, &code);
        const char *piece = from + at;
        at += size ? (size_t)size : 1;
        if (size && code == ' ') blank = n > 0;
        if (!size || code == ' ' || !pal_utf8_printable(code)) continue;
        if (n + blank + (size_t)size > PAL_MEMBER_NAME - 1 - NAME_NUMBER) break;
        if (blank) to[n++] = ' ';
        blank = false;
        memcpy(to + n, piece, (size_t)size);
        n += (size_t)size;
    }
    to[n] = 0;
    if (n == 0) strcpy(to, "guest");
}

static bool name_taken(const pal_member_list *members, const char *name)
{
    for (int k = 0; k < PAL_MEMBER_LIST_MAX; k++)
        if (members->member[k].id && !strcmp(members->member[k].name, name)) return true;
    return false;
}

pal_err pal_members_join(pal_member_list *members, pal_member_role role, const char *name, int *id)
{
    pal_member_entry *entry = NULL;
    for (int k = 0; k < PAL_MEMBER_LIST_MAX && !entry; k++)
        if (!members->member[k].id) entry = &members->member[k];
    if (!entry) return PAL_ERR_FULL;
    char plain[PAL_MEMBER_NAME], full[PAL_MEMBER_NAME + 12];
    clean_name(name, plain);
    snprintf(full, sizeof full, "%s", plain);
    for (int number = 2; name_taken(members, full); number++) snprintf(full, sizeof full, "%s %d", plain, number);
    *entry = (pal_member_entry){.id = members->next_id++, .role = role, .tool = -1};
    snprintf(entry->name, sizeof entry->name, "%.*s", PAL_MEMBER_NAME - 1, full);
    members->n_member++;
    *id = entry->id;
    return PAL_ERR_OK;
}

pal_member_entry *pal_members_find(pal_member_list *members, int id)
{
    for (int k = 0; id > 0 && k < PAL_MEMBER_LIST_MAX; k++)
        if (members->member[k].id == id) return &members->member[k];
    return NULL;
}

void pal_members_release_tool(pal_member_list *members, int id)
{
    pal_member_entry *member = pal_members_find(members, id);
    if (!member || member->tool < 0) return;
    members->holder[member->tool] = 0;
    member->tool = -1;
}

void pal_members_leave(pal_member_list *members, int id)
{
    pal_member_entry *member = pal_members_find(members, id);
    if (!member) return;
    pal_members_release_tool(members, id);
    *member = (pal_member_entry){.tool = -1};
    members->n_member--;
}

pal_err pal_members_take_tool(pal_member_list *members, int id, int tool, int *taken)
{
    pal_member_entry *member = pal_members_find(members, id);
    if (!member || member->role == PAL_MEMBER_VIEWER || tool < -1 || tool >= members->n_tool) return PAL_ERR_REFUSED;
    /* any: the tool already held, else the first free one */
    if (tool == -1) tool = member->tool;
    for (int k = 0; k < members->n_tool && tool == -1; k++)
        if (!members->holder[k]) tool = k;
    if (tool == -1 || (members->holder[tool] && members->holder[tool] != id)) return PAL_ERR_STATE;
    pal_members_release_tool(members, id);
    members->holder[tool] = id;
    member->tool = tool;
    *taken = tool;
    return PAL_ERR_OK;
}
