// SPDX-License-Identifier: GPL-3.0-or-later
// A command with texts of its own, because its caller's texts may not live until it is sent.
#pragma once

#include <string>

#include "r4link/command.hpp"

namespace r4 {

class OwnCommand {
 public:
  explicit OwnCommand(const Command& command)
      : command_(command),
        text_(command.text.data(), command.text.size()),
        text2_(command.text2.data(), command.text2.size()) {}

  // The command's texts are views of this object.
  Command get() const {
    Command command = command_;
    command.text = text_;
    command.text2 = text2_;
    return command;
  }

 private:
  Command command_;
  std::string text_, text2_;
};

}  // namespace r4
