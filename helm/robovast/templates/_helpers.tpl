{{- define "robovast.selector" -}}
app.kubernetes.io/name: robovast
app.kubernetes.io/instance: {{ .Release.Name }}
{{- end }}

{{- /* Not for pods, because each version of the chart would recreate the pods. */ -}}
{{- define "robovast.labels" -}}
{{ include "robovast.selector" . }}
app.kubernetes.io/version: {{ .Chart.AppVersion | quote }}
helm.sh/chart: {{ .Chart.Name }}-{{ .Chart.Version }}
{{- end }}

{{- define "robovast.endpoint" -}}
{{- if .Values.storage.embedded.enabled -}}
http://robovast-s3.{{ .Release.Namespace }}.svc:9000
{{- else -}}
{{ required "storage.external.endpoint is needed when storage.embedded.enabled is false" .Values.storage.external.endpoint }}
{{- end -}}
{{- end }}

{{- define "robovast.secret" -}}
{{ .Values.storage.credentials.existingSecret | default "robovast-storage" }}
{{- end }}

{{- /* Namespaces that get the Secret and the queue, as a JSON list. */ -}}
{{- define "robovast.namespaces" -}}
{{- concat (list .Release.Namespace) .Values.operator.namespaces .Values.storage.credentials.namespaces | uniq | toJson }}
{{- end }}

{{- /* A namespace that the operator manages. */ -}}
{{- define "robovast.home" -}}
{{ .Values.operator.namespaces | default (list .Release.Namespace) | first }}
{{- end }}

{{- /* The `spec` of a small campaign: two configurations of a scenario that logs a word. */ -}}
{{- define "robovast.example" -}}
{{- if .Values.kueue.enabled -}}
queueName: {{ .Values.kueue.queueName }}
{{ end -}}
{{- with .Values.example.scheduling -}}
scheduling: {{- toYaml . | nindent 2 }}
{{ end -}}
vast:
  version: 1
  configuration:
    - name: greeting
      variations:
        - ParameterVariationList: {name: text, values: [hello, world]}
  execution:
    image: {{ .Values.example.image }}
    {{- with .Values.example.resources }}
    resources: {{- toYaml . | nindent 6 }}
    {{- end }}
    scenario_file: scenario.osc
source:
  inline:
    files:
      scenario.osc: |
        import osc.helpers

        scenario say:
            text: string = "nothing"
            do serial:
                log(text)
{{- end }}

{{- /* The part that all pods of the chart share. It meets Pod Security `restricted`. */ -}}
{{- define "robovast.pod" -}}
enableServiceLinks: false
securityContext:
  runAsNonRoot: true
  runAsUser: 1000
  runAsGroup: 1000
  fsGroup: 1000
  seccompProfile:
    type: RuntimeDefault
{{- with .Values.imagePullSecrets }}
imagePullSecrets: {{- toYaml . | nindent 2 }}
{{- end }}
nodeSelector: {{- merge (deepCopy .Values.scheduling.nodeSelector) (dict "kubernetes.io/os" "linux") | toYaml | nindent 2 }}
{{- with .Values.scheduling.tolerations }}
tolerations: {{- toYaml . | nindent 2 }}
{{- end }}
{{- with .Values.scheduling.affinity }}
affinity: {{- toYaml . | nindent 2 }}
{{- end }}
{{- with .Values.scheduling.priorityClassName }}
priorityClassName: {{ . }}
{{- end }}
{{- end }}

{{- define "robovast.confined" -}}
allowPrivilegeEscalation: false
readOnlyRootFilesystem: true
capabilities:
  drop: [ALL]
{{- end }}
