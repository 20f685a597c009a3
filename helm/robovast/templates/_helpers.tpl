{{- define "robovast.labels" -}}
app.kubernetes.io/name: robovast
app.kubernetes.io/instance: {{ .Release.Name }}
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

{{- /* Restricted Pod Security for our own containers. */ -}}
{{- define "robovast.confined" -}}
allowPrivilegeEscalation: false
readOnlyRootFilesystem: true
capabilities:
  drop: [ALL]
{{- end }}

{{- define "robovast.user" -}}
runAsNonRoot: true
runAsUser: 1000
runAsGroup: 1000
fsGroup: 1000
seccompProfile:
  type: RuntimeDefault
{{- end }}
