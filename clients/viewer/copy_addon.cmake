# Copies an addon of three.js beside the viewer. cmake -D FROM=file -D TO=file -P copy_addon.cmake
file(READ ${FROM} text)
string(REGEX REPLACE "from '[t]hree'" "from '../../three.module.min.js'" text "${text}")
file(WRITE ${TO} "${text}")
