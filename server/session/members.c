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
        if (size && pal_utf8_blank(code)) blank = n > 0;
        if (!size || pal_utf8_blank(code) || !pal_utf8_printable(code)) continue;
        if (n + blank + (size_t)size > PAL_MEMBER_NAME - 1 - NAME_NUMBER) break;
        if (blank) to[n++] = ' ';
        blank = false;
        memcpy(to + n, piece, (size_t)size);
        n += (size_t)size;
    }
    to[n] = 0;
    if (n == 0) strcpy(to, "guest");
}

/* the Latin small letter or digit that a character is taken for, of those that Cyrillic and Greek share with Latin and
 * of 0 and 1 (after Unicode Technical Standard 39, confusables); else itself */
static uint32_t looks_like(uint32_t c)
{
    static const struct {
        uint32_t from[4];
        char to;
    } same[] = {
        {{0x430, 0x410, 0x391, 0x3b1}, 'a'}, {{0x412, 0x392, 0x432, 0}, 'b'},     {{0x441, 0x421, 0x3f9, 0}, 'c'},
        {{0x501, 0x500, 0, 0}, 'd'},         {{0x435, 0x415, 0x395, 0}, 'e'},     {{0x4bb, 0x41d, 0x397, 0}, 'h'},
        {{0x456, 0x406, 0x399, 0x3b9}, 'l'}, {{0x458, 0x408, 0, 0}, 'j'},         {{0x43a, 0x41a, 0x39a, 0x3ba}, 'k'},
        {{0x43c, 0x41c, 0x39c, 0}, 'm'},     {{0x39d, 0x578, 0, 0}, 'n'},         {{0x43e, 0x41e, 0x39f, 0x3bf}, 'o'},
        {{0x440, 0x420, 0x3a1, 0x3c1}, 'p'}, {{0x51b, 0x51a, 0, 0}, 'q'},         {{0x455, 0x405, 0, 0}, 's'},
        {{0x442, 0x422, 0x3a4, 0x3c4}, 't'}, {{0x3bd, 0x475, 0x474, 0}, 'v'},     {{0x51d, 0x51c, 0, 0}, 'w'},
        {{0x445, 0x425, 0x3a7, 0x3c7}, 'x'}, {{0x443, 0x423, 0x3a5, 0x3b3}, 'y'}, {{0x396, 0, 0, 0}, 'z'}};
    if (c == '0') return 'o';
    if (c == '1' || c == 'i' || c == 'I' || c == '|') return 'l';
    if (c < 0x80) return c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c;
    for (size_t k = 0; k < sizeof same / sizeof *same; k++)
        for (int i = 0; i < 4; i++)
            if (same[k].from[i] == c) return (uint32_t)same[k].to;
    return c;
}

static bool looks_the_same(const char *a, const char *b)
{
    uint32_t x = 0, y = 0;
    for (int n, m; *a && *b; a += n, b += m) {
        n = pal_utf8_next(a, strlen(a), &x), m = pal_utf8_next(b, strlen(b), &y);
        if (!n || !m || looks_like(x) != looks_like(y)) return false;
    }
    return !*a && !*b;
}

static bool name_taken(const pal_member_list *members, const char *name)
{
    for (int k = 0; k < PAL_MEMBER_LIST_MAX; k++)
        if (members->member[k].id && looks_the_same(members->member[k].name, name)) return true;
    return false;
}

/* the next number that nobody has; after the last one the count begins again */
static int take_id(pal_member_list *members)
{
    int id;
    do {
        id = members->next_id;
        members->next_id = id % PAL_MEMBER_ID_MAX + 1;
    } while (pal_members_find(members, id));
    return id;
}

void pal_members_name(const pal_member_list *members, const char *name, char unlike[PAL_MEMBER_NAME])
{
    char plain[PAL_MEMBER_NAME], full[PAL_MEMBER_NAME + 12];
    clean_name(name, plain);
    snprintf(full, sizeof full, "%s", plain);
    for (int number = 2; name_taken(members, full); number++) snprintf(full, sizeof full, "%s %d", plain, number);
    snprintf(unlike, PAL_MEMBER_NAME, "%.*s", PAL_MEMBER_NAME - 1, full);
}

pal_err pal_members_join(pal_member_list *members, pal_member_role role, const char *name, int *id)
{
    pal_member_entry *entry = NULL;
    const int kept = role == PAL_MEMBER_INSTRUCTOR ? 0 : PAL_MEMBER_INSTRUCTORS;
    if (members->locked && role != PAL_MEMBER_INSTRUCTOR) return PAL_ERR_STATE;
    for (int k = 0; k < PAL_MEMBER_LIST_MAX && !entry; k++)
        if (!members->member[k].id) entry = &members->member[k];
    if (!entry || members->n_member >= PAL_MEMBER_LIST_MAX - kept) return PAL_ERR_FULL;
    char unlike[PAL_MEMBER_NAME];
    pal_members_name(members, name, unlike);
    *entry = (pal_member_entry){.id = take_id(members), .role = role, .tool = -1, .rights = members->rights};
    memcpy(entry->name, unlike, sizeof entry->name);
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
    if (!member || member->role == PAL_MEMBER_VIEWER || member->muted || tool < -1 || tool >= members->n_tool)
        return PAL_ERR_REFUSED;
    const bool instructs = member->role == PAL_MEMBER_INSTRUCTOR;
    /* any: the tool already held, else the first free one */
    if (tool == -1) tool = member->tool;
    for (int k = 0; k < members->n_tool && tool == -1; k++)
        if (!members->holder[k] && (instructs || !members->tool_locked[k])) tool = k;
    if (tool == -1 || (members->holder[tool] && members->holder[tool] != id) ||
        (members->tool_locked[tool] && !instructs))
        return PAL_ERR_STATE;
    pal_members_release_tool(members, id);
    members->holder[tool] = id;
    member->tool = tool;
    *taken = tool;
    return PAL_ERR_OK;
}
