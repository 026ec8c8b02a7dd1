# Completion of relief in bash. The program itself knows what may come next.
_relief()
{
  local words=() word joined="" kind value rest file suffix
  # bash parts words at "="; the program takes them whole.
  for word in "${COMP_WORDS[@]:1:COMP_CWORD}"; do
    if [[ ${#words[@]} -gt 0 && ( $word == "=" || ${words[-1]} == --*= ) ]]; then
      words[-1]+=$word
    else
      words+=("$word")
    fi
  done
  # Only what stands after the "=" is replaced.
  [[ ${words[-1]} == --*=* ]] && joined=${words[-1]%%=*}=
  COMPREPLY=()
  while IFS= read -r word; do
    kind=${word%%$'\t'*}
    rest=${word#*$'\t'}
    value=${rest%%$'\t'*}
    case $kind in
      word) COMPREPLY+=("${value#"$joined"}") ;;
      part)
        compopt -o nospace
        COMPREPLY+=("${value#"$joined"}")
        ;;
      file)
        compopt -o filenames
        while IFS= read -r file; do
          [[ -d $file || -z $value ]] && COMPREPLY+=("$file") && continue
          for suffix in $value; do
            [[ ${file,,} == *"$suffix" ]] && COMPREPLY+=("$file") && break
          done
        done < <(compgen -f -- "${words[-1]#"$joined"}")
        ;;
    esac
  done < <("${COMP_WORDS[0]/#\~/$HOME}" complete -- "${words[@]}" 2>/dev/null)
}
complete -F _relief relief
