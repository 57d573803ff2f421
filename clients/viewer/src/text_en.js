// English texts of the page. {name} stands for a value.
export const ENGLISH = {
    "tools.pull": "Pull",
    "tools.pull.tip": "Pull tissue with the tool (1)",
};
