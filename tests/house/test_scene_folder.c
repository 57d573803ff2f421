/* The folder of scenes of `palpate serve --scenes`: which of its names are scenes, and that they are opened and closed
 * without a rest. */
#include "server/commands/served_scene.h"
#include "server/session/session.h"
#include "tests/check.h"

#include <dirent.h>
#include <malloc.h>
#include <sys/stat.h>
#include <unistd.h>

static char place[] = "/tmp/palpate_scenes_XXXXXX";
static pal_scene_folder folder;
static pal_session_source source;

static const char *in_folder(const char *name)
{
    static char path[200];
    snprintf(path, sizeof path, "%s/%s", place, name);
    return path;
}

static void put(const char *name, const char *text)
{
    FILE *file = fopen(in_folder(name), "w");
    REQUIRE(file);
    fputs(text, file);
    fclose(file);
}

static const char cube[] = "v 0 0 0\nv 80 0 0\nv 80 80 0\nv 0 80 0\nv 0 0 80\nv 80 0 80\nv 80 80 80\nv 0 80 80\n"
                           "f 1 4 3 2\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n";

/* files with the end of a scene, folders with a scene.json; nothing that is hidden, elsewhere, or would wait */
static void scenes_are_its_own_files_and_folders(void)
{
    char name[16][PAL_NAME];
    const int n = source.list(source.user, name, 16);
    REQUIRE(n == 3);
    CHECK_TEXT(name[0], "broken.json");
    CHECK_TEXT(name[1], "cube.obj");
    CHECK_TEXT(name[2], "organ");
    CHECK_INT(source.list(source.user, name, 2), 2);
}

static void a_bad_one_is_refused_with_a_sentence(void)
{
    pal_diagnostic diag = {""};
    pal_opened_session opened = {.session = NULL};
    CHECK(source.open(source.user, "broken.json", "broken", &diag, &opened) != PAL_ERR_OK);
    CHECK(strstr(diag.text, "broken.json") && strstr(diag.text, "JSON"));
    CHECK(!opened.session);
    diag.text[0] = 0;
    CHECK(source.open(source.user, "gone.obj", "gone", &diag, &opened) != PAL_ERR_OK); /* between list and open */
    CHECK(strstr(diag.text, "gone.obj"));
}

static int count(const char *path)
{
    int n = 0;
    DIR *dir = opendir(path);
    while (dir && readdir(dir)) n++;
    if (dir) closedir(dir);
    return n;
}

static void a_good_one_is_a_session_of_the_name_and_leaves_nothing(void)
{
    int threads = 0, files = 0;
    size_t bytes = 0;
    for (int k = 0; k < CHECK_REPEATS(40, 6); k++) {
        pal_diagnostic diag = {""};
        pal_opened_session opened = {.session = NULL};
        if (k == 3) {
            threads = count("/proc/self/task"), files = count("/proc/self/fd");
            bytes = mallinfo2().uordblks;
        }
        if (source.open(source.user, "cube.obj", "cube-7", &diag, &opened)) CHECK_FAIL("%s", diag.text);
        REQUIRE(opened.session && opened.keep);
        CHECK_TEXT(pal_session_scene(opened.session)->name, "cube-7");
        pal_session_close(opened.session);
        source.close(source.user, opened.keep);
    }
    CHECK_INT(count("/proc/self/task"), threads);
    CHECK_INT(count("/proc/self/fd"), files);
    CHECK_LE(mallinfo2().uordblks, bytes + 100000); /* what the allocator keeps for threads settles below */
}

int main(void)
{
    static const pal_served_options options = {.surface = {.resolution = 4}, .record = ""};
    pal_diagnostic diag = {""};
    if (!mkdtemp(place)) return 1;
    put("cube.obj", cube), put("broken.json", "{\"name\":"), put(".hidden.obj", cube), put("two words.obj", cube);
    put("notes.txt", "no scene"), put("back\\slash.obj", cube);
    if (mkfifo(in_folder("pipe.json"), 0600) || mkdir(in_folder("folder.json"), 0700) ||
        mkdir(in_folder("empty"), 0700) || mkdir(in_folder("organ"), 0700))
        return 1;
    put("organ/scene.json", "{}");
    CHECK(pal_scene_folder_check("/nowhere", &diag) && strstr(diag.text, "--scenes /nowhere"));
    CHECK(!pal_scene_folder_check(place, &diag));
    snprintf(folder.path, sizeof folder.path, "%s", place);
    folder.options = &options;
    source = pal_scene_folder_source(&folder);
    RUN(scenes_are_its_own_files_and_folders);
    RUN(a_bad_one_is_refused_with_a_sentence);
    RUN(a_good_one_is_a_session_of_the_name_and_leaves_nothing);
    static const char *const made[] = {"organ/scene.json", "organ",       "empty",           "folder.json",
                                       "pipe.json",        "cube.obj",    ".hidden.obj",     "two words.obj",
                                       "notes.txt",        "broken.json", "back\\slash.obj", ""};
    for (size_t k = 0; k < sizeof made / sizeof *made; k++) remove(in_folder(made[k]));
    return check_report();
}
