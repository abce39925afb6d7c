# SPDX-License-Identifier: GPL-3.0-or-later
# cmake -D FILES=… -D OUTPUT=… -P embed.cmake: converts the page's files to C++.
set(arrays "")
set(table "")
set(count 0)
foreach(file ${FILES})
  get_filename_component(name ${file} NAME)
  file(READ ${file} hex HEX)
  string(REGEX REPLACE "([0-9a-f][0-9a-f])" "0x\\1," bytes "${hex}")
  string(APPEND arrays "const unsigned char file${count}[] = {${bytes}0};\n")
  string(APPEND table "    {\"${name}\", {reinterpret_cast<const char*>(file${count}), sizeof file${count} - 1}},\n")
  math(EXPR count "${count} + 1")
endforeach()
file(WRITE ${OUTPUT} "#include \"tools/r4/web/server/page_files.hpp\"

namespace r4::tool::web {
namespace {
${arrays}const EmbeddedFile files[] = {
${table}};
}  // namespace

const EmbeddedFile* const embedded_files = files;
const int embedded_file_count = ${count};
}  // namespace r4::tool::web
")
