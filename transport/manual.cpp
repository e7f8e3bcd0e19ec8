#include "transport/manual.h"

#include "core/builtin_scenes.h"

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <string_view>
#include <vector>

namespace afterglow {
namespace {

/// As --help splits it: "INT:INT in [0 - 4096]" is a type and what is asked of its values.
struct ValueType {
    std::string name, condition;
    std::vector<std::string> choices;
};

std::vector<std::string> split(std::string_view text, char separator) {
    std::vector<std::string> parts;
    for (std::size_t end = 0; end != std::string_view::npos; text.remove_prefix(std::min(end + 1, text.size()))) {
        end = text.find(separator);
        parts.emplace_back(text.substr(0, end));
        if (end == std::string_view::npos) break;
    }
    return parts;
}

ValueType value_type(const CLI::Option& option) {
    const std::string text = option.get_type_name();
    const std::size_t colon = text.find(':');
    ValueType type{text.substr(0, colon), colon == std::string::npos ? "" : text.substr(colon + 1), {}};
    if (type.condition.starts_with('{') && type.condition.ends_with('}')) {
        type.choices = split(std::string_view(type.condition).substr(1, type.condition.size() - 2), ',');
        type.condition.clear();
        type.name.clear();
        for (const std::string& choice : type.choices) type.name += (type.name.empty() ? "" : "|") + choice;
    } else if (type.name.find('|') != std::string::npos) {
        type.choices = split(type.name, '|');
    }
    return type;
}

bool takes_value(const CLI::Option& option) { return option.get_items_expected_max() > 0; }

bool is_shown(const CLI::Option& option) { return !option.get_group().empty(); }

std::vector<const CLI::Option*> options_of(const CLI::App& app, bool positional) {
    return app.get_options([&](const CLI::Option* option) {
        return is_shown(*option) && option->get_positional() == positional;
    });
}

std::vector<const CLI::App*> commands_of(const CLI::App& app) {
    return app.get_subcommands([](const CLI::App* sub) { return !sub->get_group().empty(); });
}

/// "-o", "--output": short ones first, as --help does.
std::vector<std::string> spellings(const CLI::Option& option) {
    std::vector<std::string> result;
    for (const std::string& name : option.get_snames()) result.push_back("-" + name);
    for (const std::string& name : option.get_lnames()) result.push_back("--" + name);
    return result;
}

// ---- the page

/// Text as roff shows it: a hyphen that can be searched for and copied, no line taken for a request.
std::string roff(std::string_view text) {
    std::string result;
    for (const char c : text) {
        if (c == '\\') result += "\\e";
        else if (c == '-') result += "\\-";
        else if ((c == '.' || c == '\'') && (result.empty() || result.back() == '\n')) result += std::string("\\&") + c;
        else result += c;
    }
    return result;
}

std::string bold(std::string_view text) { return "\\fB" + roff(text) + "\\fR"; }
std::string italic(std::string_view text) { return "\\fI" + roff(text) + "\\fR"; }

std::string positional_name(const CLI::Option& option) {
    return italic(option.get_single_name()) + (option.get_expected_max() > 1 ? " ..." : "");
}

/// How the command is typed: what must be there, and that there is more.
std::string synopsis(const CLI::App& app, const std::string& name) {
    std::string line = bold(name);
    for (const CLI::Option* option : options_of(app, true))
        line += " " + (option->get_required() ? positional_name(*option) : "[" + positional_name(*option) + "]");
    for (const CLI::Option* option : options_of(app, false))
        if (option->get_required())
            line += " " + bold(spellings(*option).front()) + " " + italic(value_type(*option).name);
    return line + " [" + italic("options") + "]\n";
}

std::string paragraph(const CLI::Option& option) {
    std::string line = ".TP\n";
    if (option.get_positional()) {
        line += positional_name(option);
    } else {
        std::string names;
        for (const std::string& name : spellings(option)) names += (names.empty() ? "" : ", ") + bold(name);
        line += names;
        if (takes_value(option)) line += " " + italic(value_type(option).name);
    }
    line += "\n" + roff(option.get_description());
    if (option.get_required()) line += " (required)";
    if (takes_value(option) && !value_type(option).condition.empty())
        line += " (" + roff(value_type(option).condition) + ")";
    for (const CLI::Option* other : option.get_excludes())
        line += "; not with " + bold(spellings(*other).back());
    return line + "\n";
}

std::string paragraphs(const CLI::App& app) {
    std::string text;
    for (const bool positional : {true, false})
        for (const CLI::Option* option : options_of(app, positional)) text += paragraph(*option);
    return text;
}

// ---- the completion

/// A name that a shell function may have.
std::string function_name(std::string name) {
    std::replace_if(name.begin(), name.end(), [](unsigned char c) { return !std::isalnum(c); }, '_');
    return "_" + name;
}

/// What bash is to offer for a value; empty for numbers and other text, for which nothing is known.
std::string offer(const ValueType& type) {
    if (!type.choices.empty()) {
        std::string words;
        for (const std::string& choice : type.choices) words += (words.empty() ? "" : " ") + choice;
        return "words '" + words + "'";
    }
    if (type.name == "FILE") return "files -f";
    if (type.name == "FOLDER") return "files -d";
    if (type.name == "SCENE") return "scenes";
    return "";
}

/// Cases for the options of one command that take a value.
std::string value_cases(const CLI::App& app, const std::string& command) {
    std::string cases;
    for (const CLI::Option* option : options_of(app, false)) {
        if (!takes_value(*option)) continue;
        std::string pattern;
        for (const std::string& name : spellings(*option))
            pattern += (pattern.empty() ? "" : "|") + command + ":" + name;
        const std::string offered = offer(value_type(*option));
        cases += "    " + pattern + ") " + (offered.empty() ? "" : "offer_" + offered + "; ") + "return ;;\n";
    }
    return cases;
}

/// The case of one command where no option waits for its value: options, or what it works on.
std::string word_case(const CLI::App& app, const std::string& command) {
    std::string names, positional;
    for (const CLI::Option* option : options_of(app, false))
        for (const std::string& name : spellings(*option)) names += (names.empty() ? "" : " ") + name;
    for (const CLI::App* sub : commands_of(app)) positional += (positional.empty() ? "" : " ") + sub->get_name();
    if (!positional.empty()) positional = "words '" + positional + "'";
    const auto works_on = options_of(app, true);
    if (!works_on.empty()) positional = offer(value_type(*works_on.front()));
    return "    " + (command.empty() ? "''" : command) + ") if [[ $word == -* ]]; then offer_words '" + names + "'"
           + (positional.empty() ? "" : "; else offer_" + positional) + "; fi ;;\n";
}

} // namespace

std::string man_page(const CLI::App& app, const ManualText& text) {
    const std::string name = app.get_name();
    std::string title = name;
    std::transform(title.begin(), title.end(), title.begin(), [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
    std::string page = ".TH " + roff(title) + " 1 \"\" \"afterglow " AFTERGLOW_VERSION "\" \"User Commands\"\n"
                       + ".SH NAME\n" + roff(name) + " \\- " + roff(app.get_description()) + "\n.SH SYNOPSIS\n.nh\n.ad l\n";
    const auto commands = commands_of(app);
    for (const CLI::App* sub : commands) page += synopsis(*sub, name + " " + sub->get_name()) + ".br\n";
    page += synopsis(app, name) + ".hy\n.ad b\n.SH DESCRIPTION\n";
    for (std::string_view rest = text.description; !rest.empty();) {
        const std::size_t end = rest.find("\n\n");
        page += roff(rest.substr(0, end)) + "\n";
        if (end == std::string_view::npos) break;
        page += ".PP\n";
        rest.remove_prefix(end + 2);
    }
    for (const CLI::App* sub : commands)
        page += ".SH " + roff(name + " " + sub->get_name()) + "\n" + roff(sub->get_description()) + ".\n" + paragraphs(*sub);
    page += ".SH OPTIONS\n" + paragraphs(app);
    page += ".SH ENVIRONMENT\n.TP\n" + bold("AFTERGLOW_PORTABLE")
            + "\nIf 1, the program keeps to the instructions of every processor of its kind. Otherwise those with AVX2 "
              "run one that is compiled for them; the two differ in rounding.\n";
    page += ".SH EXIT STATUS\n0 when done, 1 after a failure (told in one line), 2 for wrong usage, 128 and its number "
            "where a signal ended it (130: Ctrl-C).\n";
    if (!text.see_also.empty()) page += ".SH SEE ALSO\n" + roff(text.see_also) + "\n";
    return page;
}

std::string bash_completion(const CLI::App& app) {
    const std::string name = app.get_name(), function = function_name(name);
    std::string commands, values = value_cases(app, ""), words = word_case(app, "");
    for (const CLI::App* sub : commands_of(app)) {
        commands += (commands.empty() ? "" : "|") + sub->get_name();
        values += value_cases(*sub, sub->get_name());
        words += word_case(*sub, sub->get_name());
    }
    std::string scenes;
    for (const auto& [spelling, about] : builtin_scene_names()) {
        std::string scene = spelling.substr(spelling.find(':') + 1);
        if (scene.ends_with(":RHO")) scene.resize(scene.size() - 3);
        scenes += (scenes.empty() ? "" : " ") + scene;
    }
    // Bash takes = and : for words of their own: --layer=full is three of them, builtin:cornell too.
    std::string script = "# Completion of " + name + " for bash, as `" + name + " --completion` prints it.\n"
        + function + "() {\n"
          "    local word=${COMP_WORDS[COMP_CWORD]} before=${COMP_WORDS[COMP_CWORD-1]} at=$COMP_CWORD command= i\n"
          "    offer_words() { mapfile -t COMPREPLY < <(compgen -W \"$1\" -- \"$word\"); }\n"
          "    offer_files() { mapfile -t COMPREPLY < <(compgen \"$1\" -- \"$word\"); compopt -o filenames 2>/dev/null; }\n"
          "    offer_scenes() {\n"
          "        offer_files -f\n"
          "        [[ -n $word && builtin: == \"$word\"* ]] && COMPREPLY+=(builtin:) && compopt -o nospace 2>/dev/null\n"
          "    }\n"
          "    COMPREPLY=()\n"
          "    if [[ $word == [=:] ]]; then word= before=${COMP_WORDS[COMP_CWORD]} at=$((COMP_CWORD + 1)); fi\n"
          "    if [[ $before == : && ${COMP_WORDS[at-2]} == builtin ]]; then\n"
          "        offer_words '" + scenes + "'; return\n"
          "    fi\n"
          "    if [[ $before == = ]]; then before=${COMP_WORDS[at-2]}; fi\n";
    if (!commands.empty())
        script += "    for ((i = 1; i < COMP_CWORD; ++i)); do\n"
                  "        case ${COMP_WORDS[i]} in " + commands + ") command=${COMP_WORDS[i]}; break ;; esac\n"
                  "    done\n";
    script += "    case $command:$before in\n" + values + "    esac\n    case $command in\n" + words + "    esac\n}\n";
    return script + "complete -F " + function + " " + name + "\n";
}

void add_manual_options(CLI::App& app, const ManualText& text) {
    const auto print_and_end = [&app](const char* option, const char* help, auto written) {
        app.add_flag_callback(option, [&app, written] {
            std::fputs(written(app).c_str(), stdout);
            throw CLI::Success();
        }, help);
    };
    print_and_end("--manual", "Prints the page for man", [text](const CLI::App& program) { return man_page(program, text); });
    print_and_end("--completion", "Prints the completion for bash", bash_completion);
}

} // namespace afterglow
