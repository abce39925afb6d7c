// SPDX-License-Identifier: GPL-3.0-or-later
#include "shell/command_line.hpp"

int main(int argc, char** argv) { return r4::tool::run(argc, argv); }
