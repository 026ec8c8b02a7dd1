# Completion of relief in fish. The program itself knows what may come next.
function __relief_complete
    set -l typed (commandline -opc)
    set -l current (commandline -ct)
    set -l program $typed[1]
    set -e typed[1]
    for line in ($program complete -- $typed "$current" 2>/dev/null)
        set -l fields (string split \t -- $line)
        switch $fields[1]
            case word part
                printf '%s\t%s\n' $fields[2] $fields[3]
            case file
                set -l name (string replace -- $fields[3] '' $current)
                for file in $name*
                    if test -d $file
                        echo $fields[3]$file/
                    else if test -z "$fields[2]"
                        echo $fields[3]$file
                    else
                        for suffix in (string split ' ' -- $fields[2])
                            string match -qi -- "*$suffix" $file; and echo $fields[3]$file; and break
                        end
                    end
                end
        end
    end
end
complete -c relief -f -a '(__relief_complete)'
