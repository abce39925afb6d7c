// SPDX-License-Identifier: GPL-3.0-or-later
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "fish_completion.hpp"
#include "option_tree.hpp"
#include "r4link/error.hpp"
#include "tools/r4/shell/options.hpp"
#include "tools/r4/shell/output.hpp"
#include "tools/r4/shell/subcommands.hpp"

namespace r4::tool {
namespace {

struct Options {
  const CLI::App* root = nullptr;
  std::string shell;
};

std::string shell_quoted(std::string_view text) {
  std::string out = "'";
  for (const char c : text) {
    if (c == '\'') {
      out += "'\\''";
    } else {
      out += c;
    }
  }
  return out + "'";
}

std::string joined_option_names(const CLI::App& command) {
  std::vector<std::string> words;
  for (const CLI::Option* const option : options_of(command)) {
    for (std::string& name : names_of(*option)) words.push_back(std::move(name));
  }
  return fmt::format("{}", fmt::join(words, " "));
}

std::string bash_case(const CLI::App& command) {
  std::string with_file;
  std::string with_value;
  for (const CLI::Option* const option : options_of(command)) {
    if (!takes_value(*option)) continue;
    std::string& list = option->get_type_name() == file_type ? with_file : with_value;
    for (const std::string& name : names_of(*option)) list += (list.empty() ? "" : " ") + name;
  }
  std::string urls;
  std::string files;
  std::string words;
  for (const CLI::Option* const positional : positionals_of(command)) {
    if (positional->get_type_name() == url_type)
      urls = fmt::format("{}", fmt::join(url_beginnings(), " "));
    if (positional->get_type_name() == file_type) files = "1";
    words += choices_of(*positional);
  }
  return fmt::format("    {}) options={} with_file={} with_value={} words={} urls={} files={} ;;\n",
                     command.get_name(), shell_quoted(joined_option_names(command)),
                     shell_quoted(with_file), shell_quoted(with_value), shell_quoted(words),
                     shell_quoted(urls), shell_quoted(files));
}

std::string bash_script(const CLI::App& root) {
  std::vector<std::string> commands;
  std::string cases;
  for (const CLI::App* const command : root.get_subcommands({})) {
    commands.push_back(command->get_name());
    cases += bash_case(*command);
  }
  std::string script = R"(# bash completion of r4, made by: r4 completion bash
# For this shell: source <(r4 completion bash)
# For all: r4 completion bash > ~/.local/share/bash-completion/completions/r4
_r4() {
  local cur=${COMP_WORDS[COMP_CWORD]} previous=${COMP_WORDS[COMP_CWORD - 1]}
  local command= options= with_file= with_value= words= urls= files= i
  for ((i = 1; i < COMP_CWORD; ++i)); do
    case ${COMP_WORDS[i]} in -*) ;; *) command=${COMP_WORDS[i]} && break ;; esac
  done
  COMPREPLY=()
  case $command in
    '') options=@ROOT_OPTIONS@ words=@COMMANDS@ ;;
@CASES@    *) return ;;
  esac
  if [[ " $with_file " == *" $previous "* ]]; then
    compopt -o filenames 2>/dev/null
    COMPREPLY=($(compgen -f -- "$cur"))
    return
  fi
  [[ " $with_value " == *" $previous "* ]] && return
  if [[ $cur == -* ]]; then
    COMPREPLY=($(compgen -W "$options" -- "$cur"))
    return
  fi
  COMPREPLY=($(compgen -W "$words $urls" -- "$cur"))
  if [[ -n $files ]]; then
    compopt -o filenames 2>/dev/null
    COMPREPLY+=($(compgen -f -- "$cur"))
  elif [[ -n $urls ]]; then
    compopt -o nospace 2>/dev/null
  fi
}
complete -F _r4 r4
)";
  const auto put = [&script](const char* place, const std::string& text) {
    script = CLI::detail::find_and_replace(script, place, text);
  };
  put("@ROOT_OPTIONS@", shell_quoted(joined_option_names(root)));
  put("@COMMANDS@", shell_quoted(fmt::format("{}", fmt::join(commands, " "))));
  put("@CASES@", cases);
  return script;
}

std::string zsh_text(std::string_view text) {
  std::string out;
  for (const char c : text) {
    if (c == '[' || c == ']' || c == ':' || c == '\\') out += '\\';
    out += c;
  }
  return out;
}

std::string zsh_value(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  if (type == file_type) return "_files";
  if (type == url_type) return "_r4_urls";
  const std::string choices = choices_of(option);
  return choices.empty() ? " " : "(" + choices + ")";
}

std::string zsh_arguments(const CLI::App& command) {
  std::string out;
  for (const CLI::Option* const option : options_of(command)) {
    const std::vector<std::string> names = names_of(*option);
    const std::string all = fmt::format("{}", fmt::join(names, " "));
    for (const std::string& name : names) {
      std::string spec = fmt::format("({}){}[{}]", all, name, zsh_text(option->get_description()));
      if (takes_value(*option)) {
        spec += fmt::format(":{}:{}", zsh_text(option->get_type_name()), zsh_value(*option));
      }
      out += " \\\n        " + shell_quoted(spec);
    }
  }
  for (const CLI::Option* const positional : positionals_of(command)) {
    const bool several = positional->get_expected_max() > 1;
    out += " \\\n        " +
           shell_quoted(fmt::format("{}:{}:{}", several ? "*" : "",
                                    zsh_text(positional->get_name(true)), zsh_value(*positional)));
  }
  return out;
}

std::string zsh_script(const CLI::App& root) {
  std::string commands;
  std::string cases;
  for (const CLI::App* const command : root.get_subcommands({})) {
    commands += fmt::format("    {}\n", shell_quoted(zsh_text(command->get_name()) + ":" +
                                                     zsh_text(command->get_description())));
    cases += fmt::format("    {})\n      _arguments -s{}\n      ;;\n", command->get_name(),
                         zsh_arguments(*command));
  }
  std::string urls;
  for (const std::string& url : url_beginnings()) {
    urls += " " + shell_quoted(url);
  }
  std::string script = R"(#compdef r4
# zsh completion of r4, made by: r4 completion zsh
# For this shell: source <(r4 completion zsh)
# For all: r4 completion zsh > a folder of $fpath, as _r4
_r4_urls() {
  compadd -S '' --@URLS@
}

_r4() {
  local context state state_descr line
  typeset -A opt_args
  local -a commands=(
@COMMANDS@  )
  _arguments -C@ROOT@ \
        '1:command:->command' '*::argument:->argument'
  case $state in
    command) _describe command commands && return ;;
    argument) ;;
    *) return ;;
  esac
  case $words[1] in
@CASES@  esac
}

if [[ $funcstack[1] == _r4 ]]; then _r4 "$@"; else compdef _r4 r4; fi
)";
  const auto put = [&script](const char* place, const std::string& text) {
    script = CLI::detail::find_and_replace(script, place, text);
  };
  put("@URLS@", urls);
  put("@COMMANDS@", commands);
  put("@ROOT@", zsh_arguments(root));
  put("@CASES@", cases);
  return script;
}

int print_completion(const Options& options) {
  const CLI::App& root = *options.root;
  print_raw(options.shell == "bash"  ? bash_script(root)
            : options.shell == "zsh" ? zsh_script(root)
                                     : fish_script(root));
  return 0;
}

constexpr const char* footer = R"(Examples:
  source <(r4 completion bash)
  r4 completion bash > ~/.local/share/bash-completion/completions/r4
  r4 completion zsh > ~/.zfunc/_r4      with ~/.zfunc in $fpath
  r4 completion fish > ~/.config/fish/completions/r4.fish

Exit codes: 0 done; 2 no such shell.)";

}  // namespace

void add_completion(CLI::App& root, Action& chosen) {
  const auto options = std::make_shared<Options>();
  options->root = &root;
  CLI::App* const command =
      add_subcommand(root, chosen, "completion", "Print the completion script of a shell", footer,
                     options, print_completion);
  command
      ->add_option_function<std::string>(
          "SHELL",
          [options](const std::string& shell) {
            if (shell != "bash" && shell != "zsh" && shell != "fish") {
              throw Error(ErrorKind::usage, shell, "a completion for this shell does not exist",
                          "use bash, zsh or fish");
            }
            options->shell = shell;
          },
          "bash, zsh or fish")
      ->required()
      ->type_name("bash|zsh|fish");
}

}  // namespace r4::tool
